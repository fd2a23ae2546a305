"""Kit of a lab: certificates, the hub's access list, and samples for its machines."""
