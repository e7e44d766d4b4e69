"""`gcs view`: the vehicle on a web page, in a process of its own, fed by Zenoh.

    feed.Feed or replay.Replay → vehicle.Vehicle → page.Page → scene, read-outs, plots, cameras in the browser

A source (live or recorded) fills one `Vehicle` for each instance with the telemetry's messages; the page asks it thirty
times a second and draws what is there. Nothing here writes to a vehicle: whoever does goes through the MAVLink link.
"""
