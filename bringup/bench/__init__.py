"""Speed, start, latency and memory, beside a bare chain of processes."""
