"""The built-in survey: scenario, scene, and what is simulated of it."""
