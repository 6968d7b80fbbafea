function code = estimate_arx(record_file, task_file, model_file)
% An estimator for the test bench in Octave or MATLAB: ARX by least squares, no packages.
%
%   hmtb verify --command "octave-cli --norc --path docs/examples --eval \"exit(estimate_arx('{mat}', '{task}', '{model}'))\""
%   hmtb verify --command "matlab -sd docs/examples -batch \"exit(estimate_arx('{mat}', '{task}', '{model}'))\""
%
% Returns the exit code: 0 done, 77 "I do not do this".
  task = jsondecode(fileread(task_file));
  if ~strcmp(task.structure, 'arx') || isempty(fieldnames(task.orders)) || task.inputs ~= 1 || task.outputs ~= 1
    fprintf(2, 'ARX of one input and one output, of the orders asked\n');
    code = 77;
    return
  end
  na = task.orders.na; nb = task.orders.nb; nk = task.orders.nk;
  record = load(record_file);          % u (N x 1), y (N x 1), dt, time, window
  u = record.u; y = record.y; N = numel(y);
  first = max(na, nb + nk - 1);
  regressors = zeros(N - first, na + nb);
  for k = 1:na
    regressors(:, k) = -y(first + 1 - k : N - k);
  end
  for k = 1:nb
    lag = nk + k - 1;
    regressors(:, na + k) = u(first + 1 - lag : N - lag);
  end
  now = y(first + 1 : N);
  theta = regressors \ now;
  errors = now - regressors * theta;
  innovation_covariance = (errors' * errors) / (numel(now) - numel(theta));
  covariance = innovation_covariance * inv(regressors' * regressors);
  poly_a = [1, theta(1:na)'];
  poly_b = [zeros(1, nk), theta(na + 1 : end)'];
  dt = record.dt;
  save([model_file, '.mat'], '-v7', 'dt', 'poly_a', 'poly_b', 'covariance', 'innovation_covariance');
  code = 0;
end
