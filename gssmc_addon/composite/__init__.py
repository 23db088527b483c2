"""CG in the photographed place: Set Up Composite makes F12 give the finished picture, Remove Composite puts everything back."""
