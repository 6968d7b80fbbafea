## octave-cli main.m METHOD {mat} {task} {model}: serves the estimator estimate_METHOD of this folder.

pkg load control
arguments = argv ();
addpath (fileparts (mfilename ("fullpath")));
serve (str2func (["estimate_" arguments{1}]));
