"""What people ride, hold or stand on: segments, joints and attachments that couple it to a body (B 3.2)."""
