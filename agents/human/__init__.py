"""A person as an agent: drives by keyboard or gamepad in `driveinsight play`."""
