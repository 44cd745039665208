"""How somebody walks, without any truth: strides, stances, ranges of joints, symmetry."""
