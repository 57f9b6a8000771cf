"""What a program or a notebook uses; `import pvid` exports it."""
