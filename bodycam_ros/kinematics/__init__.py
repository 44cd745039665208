"""Kinematics of trees of segments with joints and loops: coordinates, poses, Jacobians and limits (B 2.1-2.2)."""
