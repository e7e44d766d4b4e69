"""`gcs tune`: steps on one loop of a vehicle in Offboard flight, measured and compared, and a search for gains."""
