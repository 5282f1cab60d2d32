"""One analysis a file, its result type beside it; none draws or writes."""
