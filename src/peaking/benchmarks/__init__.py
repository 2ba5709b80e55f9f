"""Speed of the stages; quality of views from one view and of depth completion; trust in red."""
