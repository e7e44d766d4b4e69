"""What clients say to the vehicle and what it answers: recorded, reduced, and written into docs/link.md."""
