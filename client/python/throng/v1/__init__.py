"""The wire contract, generated from proto/throng/v1 while the package is built."""
