"""Compiled code: what makes a function a kernel, where what was compiled is kept, and when that happens."""
