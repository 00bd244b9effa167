# docker build -t acftc .
# docker run --rm -v "$PWD/results:/home/acftc/acftc/results" acftc acftc run on_the_road --out results/run --force
# docker run --rm acftc pytest -n 2
FROM python:3.12-slim-bookworm
RUN useradd --create-home acftc
USER acftc
WORKDIR /home/acftc/acftc
COPY --chown=acftc:acftc . .
# Makes the environment, property tables, compiled code and designs, which stay in the image.
RUN python3 start.py acftc run on_the_road && rm -rf results
ENTRYPOINT ["python3", "start.py"]
CMD ["acftc", "--help"]
