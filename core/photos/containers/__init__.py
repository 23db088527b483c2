"""The pictures inside files of several: which is the photo, how large it is, and how it is turned."""
