"""What the controller concludes from measured forces: contacts, touch-downs, landings, burden."""
