"""Every message of the program: its meaning, its place in the order, its effect on the verdict."""
