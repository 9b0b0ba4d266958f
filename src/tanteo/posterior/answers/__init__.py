"""What is asked beforehand and what is answered: priors, the pose's among them, hypotheses, status and message."""
