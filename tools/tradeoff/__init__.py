"""Speed against accuracy of models, methods, maps, random builds and other programs."""
