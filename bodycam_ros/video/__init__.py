"""Videos: files of cameras, and the frames of a video in a bag. The only place that imports PyAV."""
