"""What a recording holds, and which of its pictures are not as they should be."""
