"""The roll axis of a quadrotor on a stand."""
