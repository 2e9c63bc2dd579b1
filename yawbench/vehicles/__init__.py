"""What is known of cars: quantities and what follows from them, tyre property files, motion, mistakes."""

PLUGINS = {"kind of file": {"vehicle": "yawbench.vehicles.vehicle_file:VehicleFile"}}
