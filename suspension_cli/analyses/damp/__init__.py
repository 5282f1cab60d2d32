"""Close control loops: poles, margins, impulse response, sensor noise."""
