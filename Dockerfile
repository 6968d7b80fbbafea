# The package with everything that its tests need, in the environment that `make` makes:
#   docker build -t hmtb-twin . && docker run --rm -v "$PWD/report:/report" hmtb-twin
FROM python:3.12-slim-bookworm

# OpenGL for pictures of the arm without a display; Octave reads exported data sets in a test; a browser steers the station.
RUN apt-get update \
    && apt-get install -y --no-install-recommends make libegl1 libgl1-mesa-dri octave octave-control chromium \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /opt/hmtb-twin
COPY . .
RUN make install
ENV PATH=/opt/hmtb-twin/.venv/bin:$PATH

CMD ["make", "thesis", "OUT=/report"]
