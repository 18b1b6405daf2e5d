# AutoMOS on a CPU, kernels compiled ahead:
#
#   docker build --tag automos .
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" automos label my_log/
FROM python:3.12-slim

WORKDIR /opt/automos
COPY pyproject.toml README.md LICENSE ./
COPY src src
# hdbscan comes without a wheel for some processors and is compiled then
RUN apt-get update && apt-get install --yes --no-install-recommends build-essential \
    && pip install --no-cache-dir ".[formats]" \
    && apt-get purge --yes --auto-remove build-essential && rm -rf /var/lib/apt/lists/*

# Whoever runs the container finds the kernels compiled and the fonts listed. Numba compiles for the processor that it
# runs on: a container that goes to machines of another kind compiles there once more, in each container.
ENV NUMBA_CACHE_DIR=/opt/automos/kernels MPLCONFIGDIR=/opt/automos/matplotlib
RUN python -m automos.compiling && automos demo --out /tmp/demo && rm -rf /tmp/demo \
    && chmod -R a+rwX "$NUMBA_CACHE_DIR" "$MPLCONFIGDIR"

WORKDIR /work
ENTRYPOINT ["automos"]
CMD ["--help"]
