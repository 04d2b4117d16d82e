"""`canbase prove qualify`: thousands of failures of one robot.yaml in virtual time, and the report about them."""
