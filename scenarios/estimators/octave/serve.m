## serve (estimator): a program that stays, for the test bench.
##
## It says that it is ready, then reads a line of JSON for each record: where the record (.mat) and the task (JSON) lie
## and where the model goes. The estimator is called with u (N x nu), y (N x ny), the sampling time in s and the task,
## and returns a struct of numbers under the names that the bench knows: A, B, C, D, K or poly_a, poly_b and so on.
## An error whose identifier begins with "refused:" says that it does not do what is asked.

function serve (estimator)

  printf ("ready 1\n");
  fflush (stdout);
  while (true)
    try
      ## fgetl would look one character ahead, and wait for it.
      line = input ("", "s");
    catch
      return;
    end_try_catch
    try
      places = jsondecode (line);
      record = load (places.mat);
      task = jsondecode (fileread (places.task));
      model = estimator (record.u, record.y, record.dt, task);
      model.dt = record.dt;
      save ("-v7", [places.model ".mat"], "-struct", "model");
      printf ("done\n");
    catch failure
      word = "error";
      if (strncmp (failure.identifier, "refused:", 8))
        word = "refused";
      endif
      printf ("%s %s\n", word, strrep (failure.message, "\n", " "));
    end_try_catch
    fflush (stdout);
  endwhile

endfunction
