# An image with the command revolve, installed from its wheel:
#     docker build -t revolve-islands .
#     docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" \
#         revolve-islands run scenario1 --births 30 --out a
# Without figures and viewer, for workers: docker build --build-arg EXTRAS=cluster ...
FROM python:3.13-slim AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheel .

FROM python:3.13-slim
ARG EXTRAS=all
COPY constraints.txt /tmp/constraints.txt
COPY --from=build /wheel /tmp/wheel
RUN pip install --no-cache-dir -c /tmp/constraints.txt "$(ls /tmp/wheel/*.whl)[$EXTRAS]" \
    && rm -r /tmp/wheel /tmp/constraints.txt \
    && useradd --create-home revolve \
    && mkdir /data \
    && chown revolve /data
USER revolve
# Any user may run the image; libraries keep their caches here.
ENV HOME=/tmp
WORKDIR /data
ENTRYPOINT ["revolve"]
CMD ["--help"]
