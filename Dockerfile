# skylit and Mesa's CPU driver: an image that renders and verifies reference frames on machines without a GPU (docs/guide/ci.md).
#
#   docker build -t skylit .
#   docker run --rm -v "$PWD:/work" skylit verify tests/frames --junit frames.xml
#
# MESA=25.0.7-2~bpo12+1 pins the driver; golden images are made on one driver, and this is the one that CI should have.

FROM debian:bookworm-slim AS build
WORKDIR /skylit
COPY . .
# what `skylit --version` says of the build, which has no .git: --build-arg SKYLIT_COMMIT="$(git log -1 --format='%h (%cs)')"
ARG SKYLIT_COMMIT=
RUN ./scripts/container/build.sh /opt/skylit

FROM debian:bookworm-slim
ARG MESA=
COPY scripts/container/runtime.sh /tmp/runtime.sh
RUN /tmp/runtime.sh "$MESA" && rm /tmp/runtime.sh
COPY --from=build /opt/skylit/skylit /usr/local/bin/skylit
# compiled shaders and BVHs; mount a volume here to keep them from run to run
ENV XDG_CACHE_HOME=/cache
# anyone's, as with `docker run --user`: what the check leaves there is root's
RUN skylit doctor && rm -rf /cache && mkdir -m 1777 /cache
WORKDIR /work
ENTRYPOINT ["skylit"]
CMD ["--help"]
