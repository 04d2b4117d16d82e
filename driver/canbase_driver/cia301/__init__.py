"""CiA 301 on the wire: frames, NMT, SDO, PDO and emergency messages. No bus, no clock."""
