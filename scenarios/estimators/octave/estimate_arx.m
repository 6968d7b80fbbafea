## ARX by least squares: arx of the package control. It counts the delay beyond one sample.

function model = estimate_arx (u, y, dt, task)

  if (! strcmp (task.structure, "arx"))
    error ("refused:structure", "structure %s asked for, this method has arx", task.structure);
  elseif (columns (y) > 1)
    error ("refused:outputs", "%d outputs given, this method takes one", columns (y));
  elseif (! isfield (task.orders, "na"))
    error ("refused:orders", "no choice of orders: it has no criterion");
  elseif (task.orders.nk < 1)
    error ("refused:delay", "nk = 0 asked for, this method has a delay of one sample at least");
  endif
  n = task.orders;
  found = arx (iddata (y, u, dt), "na", n.na, "nb", n.nb, "nk", n.nk - 1);
  [above, below] = filtdata (found);
  model.poly_a = below{1, 1};
  model.poly_b = zeros (columns (u), n.nk + n.nb);
  for j = 1 : columns (u)
    model.poly_b(j, 1 : numel (above{1, j})) = above{1, j};
  endfor

endfunction
