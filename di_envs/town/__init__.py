"""Towns: lane networks, signals and crosswalks read from OpenDRIVE, and routes over them."""
