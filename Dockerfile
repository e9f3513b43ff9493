# docker build --tag radcal . && docker run --rm --volume "$PWD/results:/radcal/results" radcal
# The default command runs the default case. Apptainer: apptainer build radcal.sif docker-daemon://radcal:latest
FROM python:3.11-slim
WORKDIR /radcal
COPY . .
RUN pip install --no-cache-dir --constraint requirements.lock --editable .
CMD ["snakemake", "--cores", "2"]
