"""robot.yaml as frozen, validated objects: one file describes the robot for driver, watchdog, simulator and tools.

Import from the modules (`canbase_config.robot`, `canbase_config.load`, …): this package stays empty so that the
watchdog can take `canbase_config.watchdog`, a plain dataclass, without the libraries that validate YAML.
"""
