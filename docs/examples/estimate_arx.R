# An estimator for the test bench in R: ARX by least squares. Package: jsonlite.
# Not run by the tests of this project.
#
#   hmtb verify --command "Rscript docs/examples/estimate_arx.R {csv} {task} {model}"
library(jsonlite)

files <- commandArgs(trailingOnly = TRUE)
task <- fromJSON(files[2])
if (task$structure != "arx" || length(task$orders) == 0 || task$inputs != 1 || task$outputs != 1) {
  message("ARX of one input and one output, of the orders asked")
  quit(status = 77)
}
na <- task$orders$na; nb <- task$orders$nb; nk <- task$orders$nk
record <- read.csv(files[1])   # time, u1, y1
u <- record$u1; y <- record$y1
N <- length(y); first <- max(na, nb + nk - 1)
lagged <- function(x, lag) x[(first + 1 - lag):(N - lag)]
regressors <- cbind(
  sapply(seq_len(na), function(k) -lagged(y, k)),
  sapply(nk:(nk + nb - 1), function(k) lagged(u, k))
)
now <- lagged(y, 0)
theta <- qr.solve(regressors, now)
variance <- sum((now - regressors %*% theta)^2) / (length(now) - length(theta))
model <- list(
  dt = task$dt,
  poly_a = c(1, theta[seq_len(na)]),
  poly_b = c(rep(0, nk), theta[(na + 1):(na + nb)]),
  covariance = variance * solve(crossprod(regressors)),
  innovation_covariance = variance
)
write(toJSON(model, digits = NA, auto_unbox = TRUE), paste0(files[3], ".json"))
