"""Studies made of many solves: scenes read from files, results written to files."""
