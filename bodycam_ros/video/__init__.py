"""Videos: files of cameras, and the decoder of videos in bags. The only place that imports PyAV."""
