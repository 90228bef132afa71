"""What a robot is at one state: charts and kernels, closed loops, forces and accelerations."""
