"""Whether the libraries that users have take the package's wheel: `make compat`, docs/compatibility.md."""
