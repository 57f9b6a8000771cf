"""A drive with an elastic shaft whose load is not measured."""
