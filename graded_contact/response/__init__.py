"""The response of a layered block to pressure on its surface, wavevector by wavevector."""
