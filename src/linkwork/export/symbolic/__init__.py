"""Closed forms of the equations of motion: derived a second time, with exact numbers, named
dimensions and sines of sums of angles, to be read."""
