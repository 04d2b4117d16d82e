# The demo on simulated drives, and every other command of canbase:
#   docker build -t canbase .
#   docker run --rm canbase                      # canbase demo; exit code 0: every check passed
#   docker run --rm -it canbase canbase --help
# For trying, not for a robot: there the services run beside the kernel's CAN interface (docs/install.md).
FROM debian:bookworm-slim AS build
# hadolint ignore=DL3008
RUN apt-get update \
 && apt-get install -y --no-install-recommends ca-certificates cmake g++ gcc make python3 python3-dev python3-venv \
 && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
RUN python3 -m venv /opt/canbase \
 && /opt/canbase/bin/pip install --no-cache-dir '.[ros]'

FROM debian:bookworm-slim
# hadolint ignore=DL3008
RUN apt-get update \
 && apt-get install -y --no-install-recommends python3 \
 && rm -rf /var/lib/apt/lists/* \
 && useradd --uid 1000 --create-home canbase
COPY --from=build /opt/canbase /opt/canbase
ENV PATH=/opt/canbase/bin:$PATH
USER 1000
WORKDIR /home/canbase
CMD ["canbase", "demo"]
