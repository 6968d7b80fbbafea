# An estimator for the test bench in Julia: ARX by least squares. Packages: JSON, and what comes with Julia.
# Not run by the tests of this project.
#
#   hmtb verify --command "julia docs/examples/estimate_arx.jl {csv} {task} {model}"
using DelimitedFiles, JSON, LinearAlgebra

record_file, task_file, model_file = ARGS
task = JSON.parsefile(task_file)
if task["structure"] != "arx" || isempty(task["orders"]) || task["inputs"] != 1 || task["outputs"] != 1
    println(stderr, "ARX of one input and one output, of the orders asked")
    exit(77)
end
na, nb, nk = (task["orders"][name] for name in ("na", "nb", "nk"))
table, _ = readdlm(record_file, ',', Float64, header=true)   # time, u1, y1
u, y = table[:, 2], table[:, 3]
N, first = length(y), max(na, nb + nk - 1)
regressors = hcat([-y[first+1-k:N-k] for k in 1:na]..., [u[first+1-k:N-k] for k in nk:nk+nb-1]...)
now = y[first+1:N]
theta = regressors \ now
variance = sum(abs2, now - regressors * theta) / (length(now) - length(theta))
covariance = variance * inv(Symmetric(regressors' * regressors))
model = Dict(
    "dt" => task["dt"],
    "poly_a" => [1.0; theta[1:na]],
    "poly_b" => [zeros(nk); theta[na+1:end]],
    "covariance" => [covariance[i, :] for i in axes(covariance, 1)],   # rows
    "innovation_covariance" => variance,
)
open(io -> JSON.print(io, model), model_file * ".json", "w")
