"""Flight logs of any kind -> FlightLog; a folder for each format, and what all of them share."""
