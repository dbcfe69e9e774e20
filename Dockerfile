# An image that runs the workflow; the project folder is mounted. Not built in the tests: they run without Docker.
#   docker build -t dior .
#   docker run --rm -v "$PWD/../my_capture:/project" dior -j2
FROM python:3.11-slim
WORKDIR /dior
COPY . .
RUN pip install --no-cache-dir -r requirements.txt
ENTRYPOINT ["snakemake", "--snakefile", "/dior/Snakefile", "--directory", "/project"]
CMD ["-j2"]
