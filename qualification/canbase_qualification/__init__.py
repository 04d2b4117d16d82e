"""`canbase prove qualify`: thousands of failures of one robot.yaml in virtual time, and the report of what they came
to."""
