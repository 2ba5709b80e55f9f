"""3D Gaussian splatting on the CPU: training from posed pictures, rendering, .ply files."""
