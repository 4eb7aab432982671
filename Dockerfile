# kinemimic with the native engine: `docker build -t kinemimic .`
FROM python:3.11-slim-bookworm AS build
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends g++ make \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
RUN make setup && make wheel

FROM python:3.11-slim-bookworm
COPY --from=build /src/dist/*.whl /src/constraints.txt /tmp/kinemimic/
RUN pip install --no-cache-dir --constraint /tmp/kinemimic/constraints.txt \
        --extra-index-url https://download.pytorch.org/whl/cpu /tmp/kinemimic/*.whl \
    && rm -r /tmp/kinemimic \
    && useradd --create-home --uid 1000 kinemimic \
    && install --directory --owner=kinemimic /data
USER 1000
WORKDIR /data
ENTRYPOINT ["kinemimic"]
CMD ["--help"]
