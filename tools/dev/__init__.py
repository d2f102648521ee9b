"""For developers: the fixture and the pictures anew, a fuzzer, what tests and benches stand on."""
