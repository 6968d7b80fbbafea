## State space: moen4 of the package control, A and C by MOESP, B, D and the gain by N4SID, both of SLICOT.

function model = estimate_moen4 (u, y, dt, task)

  if (! strcmp (task.structure, "ss"))
    error ("refused:structure", "structure %s asked for, this method has ss", task.structure);
  endif
  record = iddata (y, u, dt);
  if (isfield (task.orders, "order"))
    n = task.orders.order;
    [found, ~, info] = moen4 (record, "s", max (20, 2 * n), "n", n);
  else
    [found, ~, info] = moen4 (record, "s", max (20, 2 * task.most_order), "tol", -1, "confirm", false);
  endif
  [model.A, model.B, model.C, model.D] = ssdata (found);
  model.K = info.K;
  model.innovation_covariance = info.Ry;

endfunction
