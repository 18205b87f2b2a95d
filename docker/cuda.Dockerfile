# CUDA image; build it from the top of the checkout:
#   docker build -f docker/cuda.Dockerfile -t ship_trl:cuda .
# The wheels of torch 2.13 bring CUDA 13.0 themselves; the base adds what the container toolkit
# reads, so that a driver which is too old is refused at the start. The tests run while the image is
# built, on the CPU, and one that fails stops the build.

FROM nvidia/cuda:13.0.1-base-ubuntu24.04 AS app
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3 python3-venv \
    && rm -rf /var/lib/apt/lists/* \
    && python3 -m venv /opt/venv
ENV PATH=/opt/venv/bin:$PATH \
    OMP_NUM_THREADS=1 \
    MPLBACKEND=Agg \
    SDL_VIDEODRIVER=dummy \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PIP_NO_CACHE_DIR=1 \
    PYTHONUNBUFFERED=1
WORKDIR /opt/ship_trl
# Dependencies first: they change less often than the code, and the editable link stays valid.
COPY pyproject.toml requirements.lock README.md LICENSE ./
COPY ship_trl/__init__.py ship_trl/
RUN pip install --constraint requirements.lock --editable .
COPY conf conf
COPY ship_trl ship_trl
# The verdicts of reports: the claims are no part of the package.
COPY studies studies

FROM app AS test
COPY . .
RUN pip install --constraint requirements.lock --editable '.[dev]'
# All of them, or a part that is named: --build-arg TESTS=tests/sim
ARG TESTS=tests
RUN python -m pytest $TESTS && touch /tested

FROM app
# Taking this file over is what makes the build wait for the tests.
COPY --from=test /tested /tested
# The base has a user of id 1000 already.
RUN install -d -o 1000 -g 1000 /data /data/outputs
# HOME and USER also serve a run under --user, whose id has no home and no name here.
ENV HOME=/tmp USER=ship
USER 1000:1000
WORKDIR /data
ENTRYPOINT ["python", "-m", "ship_trl"]
CMD ["--help"]
