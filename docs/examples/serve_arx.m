function serve_arx()
% The estimator of estimate_arx.m in an Octave that is started once, instead of anew for every record.
%
%   hmtb verify --stays --command "octave-cli --norc --path docs/examples --eval 'serve_arx # {mat} {task} {model}'"
%
% The placeholders stand behind a # only to say which files are wanted; their paths come with every line.
% input() returns as soon as a line is there, where Octave's fgetl(stdin) waits for the beginning of the next.
  fprintf('ready 1\n'); fflush(stdout);
  while true
    try
      line = input('', 's');
    catch
      return   % no more records
    end
    paths = jsondecode(line);
    try
      if estimate_arx(paths.mat, paths.task, paths.model) == 0
        fprintf('done\n');
      else
        fprintf('refused ARX of one input and one output, of the orders asked\n');
      end
    catch problem
      fprintf('error %s\n', problem.message);
    end
    fflush(stdout);
  end
end
