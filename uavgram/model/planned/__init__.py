"""What is planned before a flight: what is asked for, and the plan with what it will reach."""
