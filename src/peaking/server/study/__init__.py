"""The web side of user studies: what the console and the participants' phones ask for."""
