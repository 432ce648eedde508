"""Studies made of many solves: scenes run, blocks designed, finished points kept on disk."""
