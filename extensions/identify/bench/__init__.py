"""One servo that turns a pendulum: its logs, their simulation, and the fit of the servo to them."""
