"""Functional Mock-up Units: a robot as one file that simulation tools import (FMI 3.0 and 2.0)."""
