"""Actions: throttle, steer and brake, checked; and the forms that stand for them."""
