"""The body from a range of motion: joints, camera mounts and N-pose out of registered cameras (A 4.2, appendix)."""
