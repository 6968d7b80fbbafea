function serve_arx()
% The estimator of estimate_arx.m in an Octave that is started once: a second is saved with every record.
%
%   hmtb verify --stays --command "octave-cli --norc --path docs/examples --eval 'serve_arx # {mat} {task} {model}'"
%
% The placeholders stand behind a # only to say which files are wanted; their paths come with every line.
  printf("ready 1\n"); fflush(stdout);
  while ischar(line = fgetl(stdin))
    paths = jsondecode(line);
    try
      if estimate_arx(paths.mat, paths.task, paths.model) == 0
        printf("done\n");
      else
        printf("refused ARX of one input and one output, of the orders asked\n");
      end
    catch problem
      printf("error %s\n", problem.message);
    end
    fflush(stdout);
  end
end
